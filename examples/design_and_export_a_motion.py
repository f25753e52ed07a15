"""Draw a motion for a UR10e, check it with a payload, and write it as a program for the robot.

python examples/design_and_export_a_motion.py [FOLDER]
"""

import sys
from pathlib import Path

from armload import InertialParameters, arm
from armload.motion import check_motion, export_motion, random_motion, save_motion

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/motion")
folder.mkdir(parents=True, exist_ok=True)

robot = arm("ur10e")
motion = random_motion(robot, seed=3, duration=8.0)
box = InertialParameters.from_com(4.0, (0.0, 0.02, 0.1), [[0.02, 0, 0], [0, 0.02, 0], [0, 0, 0.02]])

check = check_motion(robot, motion, box)
print(check)
if check.ok:
    save_motion(folder / "excitation.json", motion)
    export_motion(motion, folder / "excitation.script", "ur")
    export_motion(motion, folder / "excitation.yaml", "ros2", joint_names=robot.joint_names)
    print("wrote", *sorted(path.name for path in folder.iterdir()))
