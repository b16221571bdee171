"""What to record next, so that explanations which fit equally well are told apart."""
