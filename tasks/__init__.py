"""What is done: one folder per step of the paper. Pure numpy functions, and beside them the body of the cached step."""
