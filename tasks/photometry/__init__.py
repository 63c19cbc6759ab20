"""What a store is for: regions chosen over all images, and a phase function fitted to their pixels."""
