"""The extremes suite: appendages at the ends of every range,
each verified by an independent check, or refused."""
