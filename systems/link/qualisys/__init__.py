"""A motion-capture system on the wire: Qualisys' real-time protocol, its client and a virtual server."""
