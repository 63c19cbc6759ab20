"""Control of a store: tie points between its images, and all poses adjusted to them together."""
