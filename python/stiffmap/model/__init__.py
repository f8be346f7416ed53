"""A machine as data: description, files, addresses, effects, springs of links, URDF."""
