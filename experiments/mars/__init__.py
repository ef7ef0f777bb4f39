"""MARS (An and Ogras, ACM TECS 2021): people before a TI IWR1443 and a Kinect, simulated from their joints."""
