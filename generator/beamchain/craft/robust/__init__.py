"""Uncertain plants: linear fractional transformations, worst cases, and their confirmation in MuJoCo."""
