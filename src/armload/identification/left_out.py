"""What the paper's related work names and armload does not build, with the reason."""

from __future__ import annotations

# by the paper's reference numbers
LEFT_OUT: dict[str, str] = {
    "vision: geometry, colour or depth images [8]": "needs a camera and a density; a log of the joints holds neither",
    "exploration: pushing, poking, tilting an object [8]": (
        "needs contact experiments before the grasp; a log is recorded after it"
    ),
    "vision and force/torque sensor together [9]": "needs both sensors",
    "wrist force/torque sensor with an IMU [15]": (
        "needs a sensor between flange and payload; if there is one, its wrench is the better measurement"
    ),
    "quaternion-based filtering [14]": (
        "estimates orientation and acceleration from an IMU; joint encoders know the orientation already"
    ),
    "chaotic sparrow search with Kent map, Student's t and Lévy flight [19]": (
        "a global search; this problem is linear and has one optimum in closed form"
    ),
    "offline techniques of dynamic identification compared in [10]": (
        "that comparison finds that only least squares and machine-learning regression work online"
    ),
    "unsupervised classification of payload changes from torque [20]": (
        "detects a change of payload, but gives no parameters; `OnlineIdentifier` detects changes"
    ),
    "support vector machine regression [21]": (
        "one model of raw signals, for the mass alone; `tree` and `network` are bags of such, for all ten parameters"
    ),
}
