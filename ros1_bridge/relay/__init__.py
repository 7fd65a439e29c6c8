"""The node `topic_relay`: named topics cross between robots that each have their own master.  Imports topics, node."""
