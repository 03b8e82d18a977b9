# The workspace on Debian 12, for computers that do not run Debian; docs/installation.md has the commands.
FROM debian:12

RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates git

WORKDIR /crazyflie
COPY . .
RUN ./run install && ./run build

# The master, the nodes and the pages in the browser are those of the host's network (--network host).
ENV ROS_IP=127.0.0.1
CMD ["./run", "shell"]
