"""Variants of a craft: what is uncertain of it, and what a draw changes in its compiled model."""
