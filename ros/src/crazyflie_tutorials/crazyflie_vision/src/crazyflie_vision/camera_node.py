"""ROS interface of the simulated camera."""

from collections import deque
from collections.abc import Iterator

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
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
)
from crazyflie_utils.parameters.types import FRAME, TOPIC, File
from crazyflie_vision.camera import CameraParameters, Pinhole, PixelNoise, Pose, load, optical_pose
from crazyflie_vision.images import camera_info, to_message
from crazyflie_vision.renderer import Renderer
from crazyflie_world.shapes import Shape
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE

#: Tolerance of the time of delivery (s): more than the rounding of times.
_EARLY = 1e-6


class CameraNodeParameters(Parameters):
    """Parameters of `CameraNode`."""

    world: World = parameter(WORLD_FILE, "world that the camera sees, a YAML file")
    camera: CameraParameters = parameter(
        File(load, "a camera's YAML file"), "the camera, a YAML file"
    )
    vehicle_frame: str = parameter(
        FRAME, "frame on which the camera is mounted", "crazyflie", name="frames/vehicle"
    )
    camera_frame: str = parameter(
        FRAME, "the camera's optical frame", "crazyflie/camera", name="frames/camera"
    )
    image_topic: str = parameter(TOPIC, "images", "camera/image_raw", name="topics/image")
    info_topic: str = parameter(
        TOPIC, "parameters of the camera, with each image", "camera/camera_info", name="topics/info"
    )


class CameraNode(Node):
    """Publish the images of a camera on a vehicle in a world.

    The poses of the vehicle and of moving objects come from tf.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._exposed: deque[tuple[float, Image, CameraInfo]] = deque()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(CameraNodeParameters)
        camera = self._parameters.camera
        self._pinhole = Pinhole.with_fov(camera.width, camera.height, camera.fov)
        self._mount = optical_pose(camera.mount)
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
        self._lookup = handle.listen_to_transforms()
        handle.timer(1.0 / parameters.camera.rate, self._expose)
        if parameters.camera.latency > 0.0:
            # From then on, images are delivered at the rate of exposures, later by the latency.
            self._wait = handle.timer(parameters.camera.latency, self._begin_delivery)

    def _begin_delivery(self):
        self._wait.stop()
        self._handle.timer(1.0 / self._parameters.camera.rate, self._deliver)

    def _expose(self):
        try:
            vehicle = _pose(
                self._lookup(self._parameters.world.frame, self._parameters.vehicle_frame)
            )
            moving = tuple(self._moving())
        except TransformError as error:
            self._handle.warn(f"no image: {error}", throttle=5.0)
            return
        image = self._noise.add(self._renderer.render(vehicle @ self._mount, moving))
        now = self._handle.time()
        header = Header(stamp=self._handle.stamp(now), frame_id=self._parameters.camera_frame)
        self._announce(header.stamp)
        self._exposed.append((now, to_message(image, header), camera_info(self._pinhole, header)))
        if self._parameters.camera.latency == 0.0:
            self._deliver()

    def _deliver(self):
        latest = self._handle.time() - self._parameters.camera.latency + _EARLY
        while self._exposed and self._exposed[0][0] <= latest:
            _, image, info = self._exposed.popleft()
            self._infos.publish(info)
            self._images.publish(image)

    def _moving(self) -> Iterator[Shape]:
        world = self._parameters.world
        for each in world.moving:
            yield each.moved_to(tuple(_pose(self._lookup(world.frame, each.name)).position))

    def _announce(self, stamp):
        transform = TransformStamped(child_frame_id=self._parameters.camera_frame)
        transform.header.stamp = stamp
        transform.header.frame_id = self._parameters.vehicle_frame
        rotation = Rotation.from_matrix(self._mount.rotation).as_quat()
        transform.transform = Transform(Vector3(*self._mount.position), Quaternion(*rotation))
        self._broadcast([transform])


def _pose(transform: TransformStamped) -> Pose:
    rotation, translation = transform.transform.rotation, transform.transform.translation
    quaternion = [rotation.x, rotation.y, rotation.z, rotation.w]
    return Pose(
        Rotation.from_quat(quaternion).as_matrix(),
        np.array([translation.x, translation.y, translation.z]),
    )
