# syntax=docker/dockerfile:1
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc g++ cmake libc6-dev pkg-config && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN cargo build --locked --release --bin mapweld

FROM debian:bookworm-slim
RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --home-dir /var/lib/mapweld --create-home mapweld
COPY --from=build /src/target/release/mapweld /usr/local/bin/mapweld
USER mapweld
WORKDIR /var/lib/mapweld
VOLUME /var/lib/mapweld
EXPOSE 8080
ENV MAPWELD_DATA=/var/lib/mapweld/data
# A server that is told to stop answers who waits and gives its jobs back; that takes 30 s at most.
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s \
    CMD ["bash", "-c", "exec 3<>/dev/tcp/127.0.0.1/8080 && printf 'GET /livez HTTP/1.0\\r\\n\\r\\n' >&3 && head -n1 <&3 | grep -q ' 200'"]
# The container's network is the fence: publish the port to trusted networks only (see compose.yaml).
CMD ["mapweld", "serve", "--listen", "0.0.0.0:8080", "--insecure"]
