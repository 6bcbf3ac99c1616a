"""`warp._src.thirdparty`: what the peer ships of others, as far as packages use it."""
