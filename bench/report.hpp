// SPDX-License-Identifier: MIT
// Named figures in the order in which they were measured, printed as text or as one JSON object.
#pragma once

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "statistics.hpp"

namespace stiffmap::bench {

class Report {
 public:
  void text(const std::string& name, const std::string& value) { lines_.emplace_back(name, '"' + value + '"'); }
  void number(const std::string& name, double value) { lines_.emplace_back(name, format(value)); }
  void timing(const std::string& name, const Summary& s) {
    lines_.emplace_back(
        name, "{\"median\": " + format(s.median) + ", \"min\": " + format(s.min) + ", \"max\": " + format(s.max) + "}");
  }
  void print(bool json) const {
    if (json) std::printf("{");
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const auto& [name, value] = lines_[i];
      if (json) std::printf("%s\"%s\": %s", i ? ", " : "", name.c_str(), value.c_str());
      else std::printf("%-40s %s\n", name.c_str(), value.c_str());
    }
    if (json) std::printf("}\n");
  }

 private:
  static std::string format(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.6g", value);
    return text;
  }
  std::vector<std::pair<std::string, std::string>> lines_;
};

}  // namespace stiffmap::bench
