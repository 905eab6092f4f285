"""Physics of the optical attitude sensor: gyro, laser planes, line images and flights."""
