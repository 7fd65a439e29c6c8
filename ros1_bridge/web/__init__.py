"""The node `web_node`: a page that shows and drives a robot through its topics.  Imports topics, node."""
