# A source build with tests: docker build -t warp-mlir . && docker run -it warp-mlir
FROM debian:12
RUN apt-get update && apt-get install -y --no-install-recommends \
    ca-certificates git make python3 python3-venv sudo && rm -rf /var/lib/apt/lists/*
WORKDIR /warp-mlir
COPY . .
RUN make build
ENV PATH="/warp-mlir/.venv/bin:${PATH}"
CMD ["python"]
