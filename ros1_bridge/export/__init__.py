"""`mrl export`: recordings as bags, MCAP files and tables, for the tools of others.  No node, and no ROS needed."""
