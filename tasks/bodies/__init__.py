"""Other bodies than the target: which of them an image shows, what hides and shadows what."""
