"""What the author of a unit imports: the block's protocol, ports with units of measurement, declarations, geometry."""
