"""ROS interface of the simulated camera."""

from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import (
    Node,
    NodeHandle,
    ParameterError,
    Parameters,
    TransformError,
    parameter,
    topic,
)
from crazyflie_utils.parameters.types import FRAME, path_of
from crazyflie_utils.tf.frame_tree import StampedPose
from crazyflie_vision.camera import CameraParameters, Pinhole, PixelNoise, Pose, load, optical_pose
from crazyflie_vision.images import camera_info, to_message
from crazyflie_vision.renderer import Renderer
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE

#: Tolerance of the time of delivery (s): more than the rounding of times.
_EARLY = 1e-6


class CameraNodeParameters(Parameters):
    """Parameters of `CameraNode`."""

    world: World = parameter(WORLD_FILE, "world that the camera sees, a YAML file")
    camera: CameraParameters = parameter(
        path_of(load, "a camera's YAML file"), "the camera, a YAML file"
    )
    vehicle_frame: str = parameter(
        FRAME, "frame on which the camera is mounted", "crazyflie", name="frames/vehicle"
    )
    camera_frame: str = parameter(
        FRAME, "the camera's optical frame", "crazyflie/camera", name="frames/camera"
    )
    image_topic: str = topic("image", "images", "camera/image_raw")
    info_topic: str = topic(
        "info", "parameters of the camera, with each image", "camera/camera_info"
    )


class CameraNode(Node[CameraNodeParameters]):
    """Publish the images of a camera on a vehicle in a world.

    The poses of the vehicle and of moving objects come from tf.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._exposed: deque[tuple[float, Image, CameraInfo]] = deque()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        camera = self._parameters.camera
        self._pinhole = Pinhole.with_fov(camera.width, camera.height, camera.fov)
        self._mount = mount = optical_pose(camera.mount)
        frames = self._parameters.vehicle_frame, self._parameters.camera_frame
        rotation = Rotation.from_matrix(mount.rotation).as_quat()
        self._frame = StampedPose(*frames, 0, tuple(mount.position), tuple(rotation))
        try:
            self._renderer = Renderer(self._pinhole, self._parameters.world)
        except OSError as error:
            raise ParameterError(f"parameter {handle.resolve('~world')}: {error}") from None
        self._noise = PixelNoise(camera.width, camera.height, camera.noise)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._images = handle.publisher(parameters.image_topic, Image)
        self._infos = handle.publisher(parameters.info_topic, CameraInfo)
        self._broadcast = handle.broadcast_transforms()
        self._lookup = handle.listen_to_poses()
        handle.timer(1.0 / parameters.camera.rate, self._expose)
        if parameters.camera.latency > 0.0:
            # From then on, images are delivered at the rate of exposures, later by the latency.
            self._wait = handle.timer(parameters.camera.latency, self._begin_delivery)

    def _begin_delivery(self):
        self._wait.stop()
        self._handle.timer(1.0 / self._parameters.camera.rate, self._deliver)

    def _expose(self):
        world = self._parameters.world
        try:
            vehicle = self._lookup(world.frame, self._parameters.vehicle_frame)
            moving = [e.moved_to(self._lookup(world.frame, e.name).position) for e in world.moving]
        except TransformError as error:
            self._handle.warn(f"no image: {error}", throttle=5.0)
            return
        pose = Pose(Rotation.from_quat(vehicle.rotation).as_matrix(), np.array(vehicle.position))
        image = self._noise.add(self._renderer.render(pose @ self._mount, moving))
        now = self._handle.time()
        header = Header(stamp=self._handle.stamp(now), frame_id=self._parameters.camera_frame)
        self._broadcast([self._frame._replace(stamp=header.stamp.to_nsec()).message()])
        self._exposed.append((now, to_message(image, header), camera_info(self._pinhole, header)))
        if self._parameters.camera.latency == 0.0:
            self._deliver()

    def _deliver(self):
        latest = self._handle.time() - self._parameters.camera.latency + _EARLY
        while self._exposed and self._exposed[0][0] <= latest:
            _, image, info = self._exposed.popleft()
            self._infos.publish(info)
            self._images.publish(image)
