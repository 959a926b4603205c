import cv2
import numpy as np

from robotcast.rigs.virtual.picture import backdrop
from robotcast.vision.camera import FiducialBoard, TrackerFacts, find_markers


def test_all_markers_are_found_where_the_camera_projects_them(lab):
    board = lab.facts.fiducials
    scene = cv2.cvtColor(backdrop(lab.camera, lab.picture), cv2.COLOR_BGR2GRAY)
    found = find_markers(scene, board)
    assert len(found) == len(board.centres_m) == 20
    for number, corners_px in found.items():
        misses = corners_px - lab.camera.project(board.corners_m(number))
        assert np.linalg.norm(misses, axis=1).max() < 1.0
        assert np.abs(misses.mean(axis=0)).max() < 0.3


def test_markers_lie_on_the_board_and_leave_the_base_free():
    board = FiducialBoard.along_edges(1.55, 2.45, side_m=0.08, margin_m=0.07, spacing_m=0.35)
    x, y = np.array(board.centres_m).T
    assert x.min() > 0.04 and x.max() < 1.51 and np.abs(y).max() < 1.185
    assert np.all((x > 0.2) | (np.abs(y) > 0.17))
    assert len(set(board.centres_m)) == len(board.centres_m)


def test_facts_survive_the_session_file(lab):
    assert TrackerFacts.of(lab.session()) == lab.facts
