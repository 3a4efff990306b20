"""The pages of results, a module per command: their sentences, and what their templates show."""
