"""Arrays: memory with a type, their views and copies, and what observes them."""
