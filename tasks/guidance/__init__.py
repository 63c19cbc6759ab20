"""What people decided about single images of a store, beside the products: it outlives them, and later runs keep it."""
