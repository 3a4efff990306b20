"""The tables of results, a module per command: the only place that says what their columns are."""
