"""Uncertain plants: linear fractional transformations, a search for the worst case,
and its run in MuJoCo."""
