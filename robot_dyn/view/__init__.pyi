# Names that tools and tests import of this folder, and where they live; modules of the core import modules.
from robot_dyn.view.document import document_of as document_of
from robot_dyn.view.geometry.visuals import Drawing as Drawing
from robot_dyn.view.geometry.visuals import Piece as Piece
from robot_dyn.view.geometry.visuals import drawing as drawing
from robot_dyn.view.geometry.visuals import solids as solids
from robot_dyn.view.page import Page as Page
from robot_dyn.view.plots.figure import NEAR as NEAR
from robot_dyn.view.plots.figure import shortened as shortened
from robot_dyn.view.plots.parts import PLOTS as PLOTS
from robot_dyn.view.plots.pictures import PlotError as PlotError
from robot_dyn.view.plots.shown import Figure as Figure
