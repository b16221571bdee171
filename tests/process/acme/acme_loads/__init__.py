"""Loads and an optimizer by ACME."""
