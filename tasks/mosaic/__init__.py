"""Maps of normalised reflectance from all images of a store: normalised, levelled, weighed, combined."""
