"""A deployment rehearsed on this machine: PostgreSQL, server, workers, schedules, and what goes wrong with them."""
