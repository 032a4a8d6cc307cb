#include "compare/error_json.h"

#include <nlohmann/json.hpp>

namespace etendue {

nlohmann::ordered_json to_json(const ImageErrors& e) {
    return {{"pixels", e.pixels},
            {"not_finite", e.not_finite},
            {"ignored", e.ignored},
            {"mse", e.mse},
            {"rmse", e.rmse},
            {"rel_mse", e.rel_mse},
            {"rel_mse_trimmed", e.rel_mse_trimmed},
            {"l1", e.l1},
            {"mape", e.mape},
            {"smape", e.smape},
            {"spike", e.spike},
            {"mean_ratio", e.mean_ratio}};
}

}  // namespace etendue
