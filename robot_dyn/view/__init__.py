"""The viewer: replays in the browser, live or as one file, and plots.

replay.py        `replay`, `show` and their files
document.py      contents of a page: runs, or a robot at one configuration
stage.py, keyframes.py    the robot as a tree of moving nodes; the samples that are drawn
overlays.py, rests.py, scenery.py    centre of mass, trace, stops, arrows; held joints; floor, gravity, camera
series.py, tables.py  the plots and the table of a page
commands.py      the canvas: commands of meshcat's viewer
page.py, picture.py       the page as a value; its still picture
geometry/        meshes and shapes, as triangles fastened to links
server.py        the server of a page on this machine
plots/           figures by Matplotlib
video/           videos of pages
web/             script, style and HTML of the page, and its text
"""

from robot_dyn.foundations.public import public_names

__getattr__, __dir__, _ = public_names(__spec__)
