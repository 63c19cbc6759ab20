"""In what order: flows that chain the tasks, and the command line."""
