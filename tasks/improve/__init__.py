"""A base map made from a store's images, and the images' orientations against it, in turn."""
