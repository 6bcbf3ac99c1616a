"""What `warp.utils` offers, by topic."""
