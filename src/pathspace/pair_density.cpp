#include "pathspace/pair_density.h"

#include <utility>

namespace etendue {

PairDensity::PairDensity(HashedCells vertices, float radius)
    : vertices_(std::move(vertices)),
      scale_(kCorrelation * double(kPi) * sqr(double(radius / vertices_.width()))) {}

}  // namespace etendue
