// Reads a map_server file with MRPT and prints what it sees: size and place, then each row from the lowest,
// one letter a cell: F free, O occupied, U unknown.
#include <mrpt/maps/COccupancyGridMap2D.h>

#include <cstdio>

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const auto map = mrpt::maps::COccupancyGridMap2D::FromROSMapServerYAML(argv[1]);
  std::printf("%u %u %.6f %.6f %.6f\n", static_cast<unsigned>(map.getSizeX()), static_cast<unsigned>(map.getSizeY()),
              map.getResolution(), map.getXMin(), map.getYMin());
  for (unsigned y = 0; y < map.getSizeY(); ++y) {
    for (unsigned x = 0; x < map.getSizeX(); ++x) {
      const float free = map.getCell(x, y);
      std::putchar(free > 0.6f ? 'F' : free < 0.4f ? 'O' : 'U');
    }
    std::putchar('\n');
  }
}
