"""A page in the browser to look at a store and to help with its images (`planetpose view`), and what is at a position
of an image (`planetpose at`)."""
