"""The private Prefect server of a machine: started when needed, kept, stopped when idle; which server a run uses."""
