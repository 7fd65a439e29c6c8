"""A web page that shows and drives one robot: `mrl web`, and with ROS `web.launch`.

`helm` decides which page drives and when the robot stops; `freshness` knows how old a command is; `messages` are those
of page and server.  These are pure: time is a parameter.  `robot` says what the server needs of a robot.  The rest is
I/O.

It imports the view model and what lies below.  aiohttp, cryptography and segno (`pip install 'mrl-driver[web]'`) are
imported here alone, when the server starts.
"""
