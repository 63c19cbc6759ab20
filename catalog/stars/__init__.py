"""Star catalogs: tables of directions, proper motions and magnitudes, whatever file they come from."""
