"""Host driver for TraxBot, StingBot and other robots that speak `@command,arguments...e` frames."""
