"""Animals and things that are no people, made by rules: cars, drones, doors, dogs, reflectors."""
