"""From measurement configurations to a calibrated robot: ``truetip design`` and ``truetip calibrate``."""
