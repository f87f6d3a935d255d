"""What encoders tell: how late and how exactly motors do what they are told, how coarse readings are."""
