"""Text that a person reads: words of numbers, quoting, and what a command prints."""
