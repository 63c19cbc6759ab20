"""What the flow `reprocess` is made of: which images have to be done and why, processes that do them, what is kept of
every run in the store."""
