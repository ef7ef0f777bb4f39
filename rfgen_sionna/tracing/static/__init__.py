"""Static scene: traced once per radar pose, with the shadows that actors cast on it."""
