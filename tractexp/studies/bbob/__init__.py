"""Optimizers on BBOB, the functions of the COCO platform."""
