bool alpha_hit(uint instance, uint primitive, float u, float v, float t){return true;}
