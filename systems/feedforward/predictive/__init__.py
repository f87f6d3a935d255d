"""What friction leaves of a motion, corrected ahead of time from the motors' encoders alone."""
