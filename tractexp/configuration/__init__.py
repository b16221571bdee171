"""Choices and settings: what can be chosen, how it is composed, checked and refused."""
