"""`planetpose report`: a store as static HTML pages."""
