"""The whole images of a virtual cell as network cameras give them: a motion JPEG stream of each over HTTP."""

import threading
from collections.abc import Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

_QUALITY = 95  # of the JPEG; below about 80 its blocks are as large as what is new in a cell
_BOUNDARY = "frame"
_PATIENCE = 1.0  # s between two looks whether the server has been closed


class ImageServer:
    """Gives everybody who asks for ``/NAME`` the newest images of that camera; who is slow misses some."""

    def __init__(self, names: Sequence[str], port: int, address: str = "127.0.0.1") -> None:
        """Opens the server, whose threads end with `close`.

        Args:
            names: of the cameras.
            port: 0 for any free one.
            address: of the interface.

        Raises:
            OSError: if the port is taken.
        """
        self._names, self._newest = list(names), threading.Condition()
        self._images: list[bytes] = []
        self._number = 0  # of the newest set
        self._seen = [False] * len(self._names)
        self._is_closed = False
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                server._serve(self)

            def log_message(self, format: str, *args: object) -> None:
                """Says nothing."""

        self._http = ThreadingHTTPServer((address, port), Handler)
        self._http.daemon_threads = True
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.1,), daemon=True)
        self._thread.start()

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._http.server_address[1]

    @property
    def are_all_seen(self) -> bool:
        """Whether somebody has begun to look at every camera."""
        return all(self._seen)

    def publish(self, images: np.ndarray) -> None:
        """Gives out the next set of images, (n, h, w, 3) of uint8."""
        options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
        encoded = [cv2.imencode(".jpg", image, options)[1].tobytes() for image in images]
        with self._newest:
            self._images, self._number = encoded, self._number + 1
            self._newest.notify_all()

    def close(self) -> None:
        """Ends all streams."""
        self._is_closed = True
        self._http.shutdown()
        self._http.server_close()
        self._thread.join()

    def _serve(self, request: BaseHTTPRequestHandler) -> None:
        name = request.path.strip("/")
        if name not in self._names:
            request.send_error(404, f"no camera {name}; there are {', '.join(self._names)}")
            return
        camera, number = self._names.index(name), 0
        request.send_response(200)
        request.send_header("Content-Type", f"multipart/x-mixed-replace; boundary={_BOUNDARY}")
        request.end_headers()
        try:
            while not self._is_closed:
                with self._newest:
                    self._newest.wait_for(lambda: self._number > number, _PATIENCE)  # noqa: B023 - at once
                    if self._number == number:
                        continue
                    number, image = self._number, self._images[camera]
                self._seen[camera] = True
                head = f"--{_BOUNDARY}\r\nContent-Type: image/jpeg\r\nContent-Length: {len(image)}\r\n\r\n"
                request.wfile.write(head.encode() + image + b"\r\n")
        except OSError:
            return  # nobody looks any more
