"""A web page that shows and drives one robot: `mrl web`, and with ROS `web.launch`.

`helm` decides which page drives, how old a command is, and when the robot stops; `messages` are those of page and
server.  These are pure: time is a parameter.  `robot` says what the server needs of a robot.  The rest is I/O.

It imports the view model and what lies below.  aiohttp, cryptography and segno (`pip install 'mrl-driver[web]'`) are
imported here alone, when the server starts.
"""
