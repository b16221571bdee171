"""What was computed and is kept, under keys of all that it depends on."""
